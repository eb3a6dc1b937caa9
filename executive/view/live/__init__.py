"""Live page: a web page with which a user watches and controls a run.

A separate process serves the page on the loopback address. Every request must come from the page itself and
contain the secret token in the page address, so that no other page can read or control the run.
"""
