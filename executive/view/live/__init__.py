"""Live page, on which a user with its address watches and controls a run in a browser.

It is served by a process of its own, on loopback only. Whoever wants anything of it must know the token in
its address and come from no other page than itself, so that no page elsewhere in the browser can see or
command anything.
"""
