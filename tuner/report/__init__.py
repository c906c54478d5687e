"""Results for people: tables, figures and the page, in customary units. Drawing libraries are imported only here."""
