"""A recorded scene in the Rerun viewer. All but `run` needs the extra `view`."""
