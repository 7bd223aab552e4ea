use credence_embed::{MetricEmbedder, QueryEmbedder};

use crate::{MetricConfig, PipelineError};

/// The networks, each loaded when it is first needed.
pub(crate) struct Embedders {
    pub(crate) query: Option<QueryEmbedder>,
    pub(crate) metric: Option<MetricEmbedder>,
}

impl Embedders {
    /// Files of weights are read at once, so that a wrong one is found before any work is done.
    pub(crate) fn new(config: &MetricConfig) -> Result<Self, PipelineError> {
        Ok(Self {
            query: config
                .query_weights
                .file()
                .map(QueryEmbedder::from_file)
                .transpose()?,
            metric: config
                .metric_weights
                .file()
                .map(MetricEmbedder::from_file)
                .transpose()?,
        })
    }

    pub(crate) fn query(&mut self) -> Result<&QueryEmbedder, PipelineError> {
        let embedder = match self.query.take() {
            Some(embedder) => embedder,
            None => QueryEmbedder::embedded()?,
        };
        Ok(self.query.insert(embedder))
    }

    pub(crate) fn metric(&mut self) -> Result<&MetricEmbedder, PipelineError> {
        let embedder = match self.metric.take() {
            Some(embedder) => embedder,
            None => MetricEmbedder::embedded()?,
        };
        Ok(self.metric.insert(embedder))
    }
}
