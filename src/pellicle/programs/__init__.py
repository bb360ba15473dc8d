"""Compiled programs that outlive the process, in files that nobody else can write; threads of workers."""
