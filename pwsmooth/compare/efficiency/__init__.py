"""Work against precision: cases, methods, measurements, charts."""
