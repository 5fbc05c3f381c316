"""What a user hands to the command line: pictures, disparity files, values of flags."""
