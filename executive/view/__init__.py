"""Views of a run: terminal, live page, report, film, and pictures of the tree."""
