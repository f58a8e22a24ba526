"""Object stores: paths of objects, range reads, and transfers, through botocore and obstore."""
