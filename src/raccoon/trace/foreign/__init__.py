"""Recordings of others, converted into the columns of this library; doubtful values are reported."""
