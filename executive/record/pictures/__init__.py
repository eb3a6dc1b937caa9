"""The pictures behind the decisions: what one shows, how it is drawn, and the process that draws it."""
