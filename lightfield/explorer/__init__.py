"""The explorer: a page in the browser where effects are switched and parameters dragged, and all follows."""
