"""Stands in for the helper program and misbehaves as its argument says; `python -m scripted_program`."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading


def say(**message: object) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


how = json.loads(sys.argv[1])["how"]
if how == "unusable":
    say(setup_error="ImportError: no inference_sdk")
    sys.exit()
if how == "never ready":
    threading.Event().wait()
say(ready=True)
if how == "deaf":
    threading.Event().wait()
header = json.loads(sys.stdin.buffer.readline())
sys.stdin.buffer.read(header["width"] * header["height"] * 3)
if how == "ends":
    sys.stderr.write(f"Traceback:\nZeroDivisionError: {os.environ['ROBOFLOW_API_KEY']}\n")
    sys.exit(3)
if how == "is killed":
    os.kill(os.getpid(), signal.SIGKILL)
if how == "nests":
    sys.stdout.write('{"answer": ' + "[" * 5000 + "]" * 5000 + "}\n")
    sys.stdout.flush()
if how == "talks":
    sys.stderr.write("words " * 100_000)
    say(answer=header)
threading.Event().wait()
