"""Reflectance sensors: readings over white and black, and what explains them."""
