"""What is said, apart from what is computed: messages by key, catalogues of texts, quantities in words."""
