"""What happens at an instant."""
