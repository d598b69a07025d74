"""What runs left behind: where numbers come from, where each study stands, and the front page of it all."""
