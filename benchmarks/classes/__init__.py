"""The render of 15 scenes, class of light by class, against photons walked by independent code."""
