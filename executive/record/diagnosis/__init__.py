"""Why a run did not succeed: what is remembered of its course, and the story told from that in the end."""
