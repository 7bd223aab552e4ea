"""A run as one HTML file that needs no network: verdict, tables, curves, scenes, provenance."""
