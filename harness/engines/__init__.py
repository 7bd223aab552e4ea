"""Where jobs are computed: worker processes of this machine, or a Ray cluster."""
