"""Results of renders: data sets, images, numbers read off them."""
