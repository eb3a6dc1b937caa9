"""Detectors that use a Roboflow inference server, hosted or self-hosted.

inference-sdk has no timeout: it waits forever for a server that does not answer. The library
therefore runs in a helper process (`__main__.py`), which is killed and replaced after a missed deadline.
"""
