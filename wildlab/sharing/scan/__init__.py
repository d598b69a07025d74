"""Is anything in the files about to be sent that must not be: places, dates, names, numbers that locate.

Every byte is looked at: as text in any encoding, as binary numbers at every offset, and once more in whatever
can be unpacked. What cannot be looked into is a finding too. Not looked for: what is drawn (the pixels of
pictures, letters as outlines), and what was hidden on purpose.
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.sharing.scan.files import not_searched, scan, scan_contents
    from wildlab.sharing.scan.findings import Finding
    from wildlab.sharing.scan.secrets import Secrets

__all__ = ["Finding", "Secrets", "not_searched", "scan", "scan_contents"]

__getattr__, __dir__ = offer(__name__)
