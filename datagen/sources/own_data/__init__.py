"""Readers of a user's own data, which follows no published layout: a folder, whose names say what each file is, or a
list of files.
"""
