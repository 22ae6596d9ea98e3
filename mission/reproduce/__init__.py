"""Does what the paper reports come out here?  Its Results section, and what it left for later, as one resumable run."""
