"""From positioned text to the model, and everything that is wrong with its form."""
