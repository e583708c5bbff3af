"""The photon walk and what drives it."""
