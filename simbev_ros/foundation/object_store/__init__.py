"""Object stores: paths of objects, range reads, and transfers, through pyarrow's file systems."""
