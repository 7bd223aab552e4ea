use std::fmt;

/// A function of a Python module.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PythonFunction {
    /// The module's full name, its parts separated by dots.
    pub module: String,
    /// The function's name in it.
    pub function: String,
}

impl PythonFunction {
    const PREFIX: &str = "python:";

    /// Reads "python:module.function"; `None` if that cannot be names in Python.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let is_name = |part: &str| {
            let mut letters = part.chars();
            let first = letters.next();
            first.is_some_and(|c| c.is_alphabetic() || c == '_')
                && letters.all(|c| c.is_alphanumeric() || c == '_')
        };
        let path = text.strip_prefix(Self::PREFIX)?;
        let (module, function) = path.rsplit_once('.')?;
        path.split('.').all(is_name).then(|| Self {
            module: module.to_owned(),
            function: function.to_owned(),
        })
    }
}

impl fmt::Display for PythonFunction {
    /// As the configuration spells it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}.{}", Self::PREFIX, self.module, self.function)
    }
}

/// The names that a configuration spells a stage's choices by, a function in Python among them.
macro_rules! named_or_python {
    ($choice:ident, $what:literal, [$($variant:ident = $name:literal),+]) => {
        impl std::fmt::Display for $choice {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                match self {
                    $(Self::$variant => f.write_str($name),)+
                    Self::Python(function) => function.fmt(f),
                }
            }
        }

        impl From<$choice> for String {
            fn from(choice: $choice) -> Self {
                choice.to_string()
            }
        }

        impl std::str::FromStr for $choice {
            type Err = $crate::PipelineError;

            fn from_str(name: &str) -> Result<Self, Self::Err> {
                let choice = match name {
                    $($name => Some(Self::$variant),)+
                    _ => PythonFunction::parse(name).map(Self::Python),
                };
                choice.ok_or_else(|| $crate::PipelineError::Choice {
                    what: $what,
                    why: format!(
                        "unknown {} `{name}`, expected one of {} or \"python:module.function\", \
                         the function's full name in Python",
                        $what,
                        [$(concat!("`", $name, "`")),+].join(", "),
                    ),
                })
            }
        }

        impl TryFrom<String> for $choice {
            type Error = $crate::PipelineError;

            fn try_from(name: String) -> Result<Self, Self::Error> {
                name.parse()
            }
        }
    };
}

pub(super) use named_or_python;
