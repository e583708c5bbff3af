"""The best set of effects: how sure each is, how large, and what is too small to be named beside it."""
