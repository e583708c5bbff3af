"""The render of 13 scenes, class of light by class, against photons walked by independent code."""
