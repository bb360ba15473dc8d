"""Compiled programs that outlive the process, as machine code in files that nobody else can write."""
