//! What each failure class means and what would help: the paragraphs of `docs/failures.md`, which the page shows too.

use vmao_core::outcome::FailureStage;

const DOCUMENT: &str = include_str!("../../../../docs/failures.md");

/// What a failure class means, and what would help; empty if the document lacks it.
pub(crate) fn explanation(stage: FailureStage) -> [String; 2] {
    let heading = format!("\n## {}\n", stage.name());
    let section = DOCUMENT.split_once(&heading).map_or("", |(_, rest)| rest);
    let section = section.split("\n## ").next().unwrap_or_default();
    let paragraph = |name: &str| {
        let paragraphs = section.split("\n\n").map(str::trim);
        let found = paragraphs.filter_map(|paragraph| paragraph.strip_prefix(name)).next().unwrap_or_default();
        found.split_whitespace().collect::<Vec<_>>().join(" ").replace(['`', '*'], "")
    };
    [paragraph("**Means.**"), paragraph("**Would help.**")]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_failure_class_is_explained_in_words() {
        for stage in FailureStage::ALL {
            for text in explanation(stage) {
                assert!(text.len() > 80 && text.ends_with('.') && !text.contains("]("), "{}: {text:?}", stage.name());
            }
        }
    }
}
