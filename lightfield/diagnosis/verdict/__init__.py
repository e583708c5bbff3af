"""What is said of a finding: verdict, ladder, advice, words."""
