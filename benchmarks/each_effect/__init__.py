"""Every effect of the table, one after the other: is it found where it is hidden?"""
