"""Models behind a Roboflow inference server, hosted or one's own.

inference-sdk has no timeout and waits for ever for a server that does not answer. It therefore runs in a
helper process (`__main__.py`), which is killed and replaced when a deadline passes.
"""
