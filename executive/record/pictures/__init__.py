"""Pictures of selections and failures: content, drawing, and the thread that draws."""
