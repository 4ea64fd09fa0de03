"""What people read: texts in their language, and numbers and angles as text."""
