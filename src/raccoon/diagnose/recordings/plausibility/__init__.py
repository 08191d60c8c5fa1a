"""Plausibility of a drive's diagnosis: one fault that looks like several causes, and impossible values."""
