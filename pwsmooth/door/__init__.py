"""What a user gives, checked and put into words: arguments, formulas as text, what results show."""
