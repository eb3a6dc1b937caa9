"""Live page, on which a user who knows its address watches and controls a run in a browser.

A separate process serves the page, on loopback only. Every request must contain the token of the address and
come from the page itself, so that no other page in the browser can read or control the run.
"""
