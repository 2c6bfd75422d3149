"""The recorder node: any topic, raw, into a bag."""
