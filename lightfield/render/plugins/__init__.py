"""Our Mitsuba plugins. Importing them finds a usable LLVM first."""

from lightfield.render.backend import prepare

# Here, because importing Mitsuba loads an LLVM at once, and every module of this package imports Mitsuba.
prepare()
