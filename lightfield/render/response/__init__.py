"""What a trace is tallied into, and how any water is evaluated from it."""
