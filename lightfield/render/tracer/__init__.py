"""The photon walk and what drives it."""

from lightfield.render.backend import prepare

# Here, because importing Mitsuba loads an LLVM at once, and every module of this package may import Mitsuba.
prepare()
