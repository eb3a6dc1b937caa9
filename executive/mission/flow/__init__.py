"""Abstract execution of the tree, and the failures that no node handles."""
