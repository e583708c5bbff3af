"""Light on receivers that may stand and face anywhere: the flux vector, traced once, for every water."""
