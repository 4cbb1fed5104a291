"""Contact detection: from surfaces to pairs to contacts (Contact, 3.2)."""
