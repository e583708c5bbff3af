"""Every effect of the best set: how sure it is, as data and in words."""
