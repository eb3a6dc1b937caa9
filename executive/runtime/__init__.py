"""The tick loop, halting and the variables of a running mission."""
