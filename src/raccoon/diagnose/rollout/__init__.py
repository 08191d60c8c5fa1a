"""The simulator along the commands of a recording, with what is known of its controller."""
