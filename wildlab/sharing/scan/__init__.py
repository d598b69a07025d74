"""Is anything in the files about to be sent that must not be: places, dates, names, numbers that locate.

`wildlab.sharing.scan.secrets_of.secrets_of` collects from a flight what must not leave;
`wildlab.sharing.scan.scan.scan` looks at every byte: as text in any encoding, as binary numbers at every
offset, and once more in whatever can be unpacked. What cannot be looked into is a finding too. Not looked for:
what is drawn (the pixels of pictures, letters as outlines), and what was hidden on purpose.
"""
