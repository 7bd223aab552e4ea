use std::{fmt, str::FromStr};

use crate::InvalidInput;

/// Class index of free space in the Gaussian process and in class histograms.
pub const FREE_CLASS: u8 = 0;

/// Number of classes: free space and the six categories.
pub const CLASS_COUNT: usize = Category::ALL.len() + 1;

/// The six object categories of NOCS (Wang et al. 2019), in its order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Category {
    /// Bottles, upright or lying.
    Bottle = 1,
    /// Bowls, plates with a rim.
    Bowl = 2,
    /// Photo cameras.
    Camera = 3,
    /// Cans and tins.
    Can = 4,
    /// Opened laptops.
    Laptop = 5,
    /// Mugs and cups, with or without a handle.
    Mug = 6,
}

impl Category {
    /// All categories in class order.
    pub const ALL: [Self; 6] = [
        Self::Bottle,
        Self::Bowl,
        Self::Camera,
        Self::Can,
        Self::Laptop,
        Self::Mug,
    ];

    /// Class index, 1 to 6; 0 is [`FREE_CLASS`].
    pub const fn class(self) -> u8 {
        self as u8
    }

    /// The category of a class index; `None` for free space and for indices past the last class.
    pub fn from_class(class: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|c| c.class() == class)
    }

    /// Lower-case name, as in NOCS.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bottle => "bottle",
            Self::Bowl => "bowl",
            Self::Camera => "camera",
            Self::Can => "can",
            Self::Laptop => "laptop",
            Self::Mug => "mug",
        }
    }
}

impl fmt::Display for Category {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Category {
    type Err = InvalidInput;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|c| c.name() == name)
            .ok_or_else(|| InvalidInput::Category {
                name: name.to_owned(),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_count_from_one_in_nocs_order() {
        let classes: Vec<u8> = Category::ALL.iter().map(|c| c.class()).collect();
        assert_eq!(classes, [1, 2, 3, 4, 5, 6]);
        assert_eq!(Category::from_class(FREE_CLASS), None);
        assert_eq!(Category::from_class(7), None);
    }

    #[test]
    fn names_round_trip() {
        for category in Category::ALL {
            assert_eq!(category.name().parse(), Ok(category));
        }
        let message = "Mug".parse::<Category>().unwrap_err().to_string();
        assert!(message.contains("'Mug'") && message.contains("mug"));
    }
}
