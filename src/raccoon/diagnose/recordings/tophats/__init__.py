"""The diagnosis of reflectance sensors (tophats) by their readings over white and black."""
