"""What a person sees: tables in customary units and figures. Drawing libraries are imported only here."""
