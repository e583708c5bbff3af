"""The page of a study of attenuation."""
