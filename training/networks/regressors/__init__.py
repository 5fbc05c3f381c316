"""Networks from a pair of views to a disparity map, one module each."""
