"""Recordings made by others, brought into the columns of this library, with what is doubtful in them."""
