"""What a pilot takes along: way points in the formats of ground stations and maps.

A writer takes arrays and gives text; where it is written, and that positions are secrets, is the business of
whoever calls it.
"""
