"""What a study varies, and the values that each of its runs gets."""
