"""Views of a run: terminal, live page, report, video, and pictures of the tree."""
